"""The standard formulation of one large scene on two threads."""
