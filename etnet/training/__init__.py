"""Train a network on clips that are simulated on the fly."""
