"""The commands of `dap3d`, one a file."""
