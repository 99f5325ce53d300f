"""Trial of a type before use: its kernels are called once with random arguments."""
