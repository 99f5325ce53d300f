"""Joint motions: the free relative motions of joints, from C and J alone; joint coordinates."""
