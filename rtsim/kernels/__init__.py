"""How kernels are made, kept and called; what all of them use."""
