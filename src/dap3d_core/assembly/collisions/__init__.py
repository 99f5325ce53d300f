"""Where shapes that collide meet: points, normals and gaps of pairs."""
