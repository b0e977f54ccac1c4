"""Where results come from: digests of code, records of runs, archives and their verification."""
