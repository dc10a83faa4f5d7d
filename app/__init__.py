"""The viewer: recordings, their reconstruction and what the network looks at, in a browser."""
