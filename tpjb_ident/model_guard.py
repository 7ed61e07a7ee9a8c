"""`model` is a common name: make sure that the one that Python finds is ours."""


def check_model() -> None:
    """Do nothing if `import model` gives the bundled bearing model."""
    import model

    if getattr(model, "DISTRIBUTION", None) != "tpjb-ident":
        raise ImportError(
            f"another package named 'model' ({model}) hides the bearing model of tpjb-ident. Rename it, start "
            "Python from another folder, or take its folder off sys.path / PYTHONPATH."
        )
