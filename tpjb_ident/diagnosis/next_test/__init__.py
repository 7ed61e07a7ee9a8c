"""The one more test that would separate what these data cannot tell apart."""
