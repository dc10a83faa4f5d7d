"""Arrays → pictures (uint8): tone, colours, overlays. numpy and OpenCV only; no torch, no viewer."""
