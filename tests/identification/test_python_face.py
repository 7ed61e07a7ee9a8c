"""`ti.identify` from Python: the flags of the command line, a method by its name, errors that name the function."""

import pytest

import tpjb_ident as ti
from rigdata import load_campaign
from tpjb_ident.arguments import carried_bearing, checked
from tpjb_ident.cli.options import DEMO, ROCKER


def settings_that_reach(call):
    """The settings with which a function that is called as `identify` is called."""
    reached = []

    def identify(campaign, settings=None, method=None):
        reached.append(settings)

    call(checked(identify, "identify", "campaign", ti.IdentifySettings))
    return reached[0]


def test_the_amplitude_is_held_against_the_clearance_of_the_campaigns_bearing():
    campaign = load_campaign(DEMO)
    assert min(carried_bearing(campaign, pytest.fail).clearances) == pytest.approx(80e-6)
    assert settings_that_reach(lambda identify: identify(DEMO)).clearance == pytest.approx(80e-6)
    stated = ti.IdentifySettings(clearance=60e-6)
    assert settings_that_reach(lambda identify: identify(campaign, stated)).clearance == 60e-6


def test_an_unknown_method_is_refused_before_anything_is_computed():
    with pytest.raises(ValueError, match=r"identify: unknown method 'mm-eib'\. Did you mean 'mm-eiv'"):
        ti.identify(DEMO, method="mm-eib", progress=pytest.fail)


def test_an_error_names_the_function():
    with pytest.raises(TypeError, match=r"identify: .*'metod'.*it takes campaign, settings"):
        ti.identify(DEMO, metod="mm")
    with pytest.raises(TypeError, match=r"identify: missing .*campaign"):
        ti.identify()


def test_campaign_and_bearing_show_themselves_in_a_notebook():
    page = load_campaign(DEMO)._repr_html_()
    assert "<td>dry_pivot</td>" in page
    pads = ti.load_bearing(ROCKER)._repr_html_()
    assert pads.count("<li>") == 5
    assert "<ol><li>pad at -90 deg" in pads
