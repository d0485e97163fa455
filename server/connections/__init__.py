"""Who is connected: how many, how long they may take, and how much they may say."""
