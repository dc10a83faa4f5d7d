"""One module for each family of formats. All give `Opened`; `table` lists them."""
