"""The random numbers, roots and cells of float64 kernels, which cannot be made from those of float32."""
