"""Work on a Dask cluster: one way to reach it, to know its workers, to hand out pieces and to lose none."""
