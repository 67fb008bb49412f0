"""Everything that is the XV-15: published data, their readers, the nonlinear model in its plane of symmetry."""
