"""The page: the session in a browser, drawn and asked by viser in a process of its own (`process.PageProcess`)."""
