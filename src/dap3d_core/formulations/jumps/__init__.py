"""Jumps of velocities: impulses of elements, solved together with the joints that hold."""
