"""The three-dimensional scene of a page: bodies, shapes, joints, forces, arrows."""
