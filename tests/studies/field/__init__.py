"""Field battery: identification on rigs that have what real ones have, against a bearing known in closed form."""
