"""An articulated model as a scene, and the files that it is read from."""
