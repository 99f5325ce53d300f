"""Parts that integrators share: state, step control, output, event location, singular poses."""
