"""What runs on the device between Fourier transforms: nothing here knows of files or scenes. Open `advance` first.

- `voxels`: how much of each cell of a slice solids of one index fill.
- `advance`: a slice's scattered light added to the spectrum, and the spectrum at the middle of the next slice.
- `intensity`: images of the points of the condenser, summed.

Complex numbers are `wp.vec2f`. CPUs have forms of their own that go along rows, which Clang turns into vector code.
"""
