"""Every figure and every claim of the paper, from flights of this simulator: ``rtsim reproduce``.

``flights`` flies, ``measures`` turns a flight into numbers, ``claims`` compares the numbers with the paper, ``figures``
draw and ``report`` writes it all down.
"""
