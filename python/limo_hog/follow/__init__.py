"""What the follower sees and what it says: types and controllers, without simulator or clock."""
