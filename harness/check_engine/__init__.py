"""``ninedisk check-engine``: an adapter on scenes so small that every number is known in closed form."""
