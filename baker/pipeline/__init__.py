"""The stages of a bake in order, and what each hands to the next; the only place that wires them."""
