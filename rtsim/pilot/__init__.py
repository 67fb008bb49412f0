"""The virtual pilot: design by the Modified Optimal Control Model (MOCM), schedule, online kernels."""
