"""The best conversion: paths as data, figures of merit in compiled batches, the search for the best path."""
