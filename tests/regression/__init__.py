"""Tools that compare two trees; they hold no truth of their own."""
