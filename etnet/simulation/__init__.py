"""Made-up recordings: pictures move, a modelled sensor watches, and everything about them is known."""
