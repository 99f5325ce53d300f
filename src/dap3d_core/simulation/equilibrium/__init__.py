"""Static equilibrium of a scene, and starts from rest."""
