"""Contact types: what their authors declare, and the rows that are derived from it."""
