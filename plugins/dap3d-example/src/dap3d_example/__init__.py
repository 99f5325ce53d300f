"""Types for dap3d that users ask for and the manual lacks; an example of a package of types."""
