"""Drake."""
