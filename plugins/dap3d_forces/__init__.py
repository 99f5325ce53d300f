"""The standard force elements, one file each. They use only what any third party may use."""
