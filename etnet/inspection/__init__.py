"""What the inspectors show, as arrays with named axes: attention, state, input, and what they do to a pixel."""
