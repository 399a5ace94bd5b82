"""What a store shows: stored rows joined into cases and engines, ranked, and as the pages print them."""
