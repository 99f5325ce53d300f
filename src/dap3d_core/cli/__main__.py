"""``python -m dap3d_core.cli``: the command line without its installed script."""

from dap3d_core.cli import main

raise SystemExit(main())
