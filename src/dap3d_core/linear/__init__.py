"""The linear layer: block LDL^T of the saddle-point matrix in a static order; rank."""
