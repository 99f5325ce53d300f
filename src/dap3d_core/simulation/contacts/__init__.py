"""Contacts of a run: which are closed, stick and slip; impacts; what a result says of them."""
