"""Console output: tables, progress, summaries."""
