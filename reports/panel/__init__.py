"""What a store tells: stored rows joined into cases and engines, ranked, and as the pages print them."""
