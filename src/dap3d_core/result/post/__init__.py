"""Post-processing: point motion, reactions, forces, ledger, global error."""
