"""One module per figure of docs/how_it_works: what it shows, computed by the library, and drawn."""
