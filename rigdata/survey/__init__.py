"""Looking at exports of which nothing is known yet: what the channels may be, which runs these are, a draft."""
