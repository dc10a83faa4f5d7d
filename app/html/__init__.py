"""Building blocks of every view's HTML: elements, units, tones, the moment on the page. Knows no view."""
