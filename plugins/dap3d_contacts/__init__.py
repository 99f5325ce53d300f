"""The standard contacts, one file each. They use only what any third party may use."""
