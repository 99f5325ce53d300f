"""Time stepping of contacts: impulses over steps of equal length (Moreau)."""
