"""Surveillance presets by name, and changed ones."""

from dataclasses import replace

import pytest

from companion.errors import ConfigError
from sim.campaign.flight import as_report
from sim.campaign.plan import Plan
from sim.encounters import SURVEILLANCE_PRESETS, Observer, generate, surveillance_of


def test_a_changed_preset_keeps_its_other_fields() -> None:
    how = surveillance_of("adsb-out,latency_s=3,loss=0.4,age_reported=true")
    wanted = replace(SURVEILLANCE_PRESETS["adsb-out"], latency_s=3.0, loss=0.4, age_reported=True)
    assert how == wanted
    assert surveillance_of("poor") is not None
    assert Plan(1, surveillance=("poor,first_heard_m=900",)).first_surveillance.first_heard_m == 900.0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("magic", "there are perfect, adsb-out, poor, flarm, gdl90-1hz, remote-id"),
        ("", "there are perfect"),
        ("poor,colour=3", "no field 'colour'; there are period_s, latency_s"),
        ("poor,", "no field ''"),
        ("poor,loss", "loss is a number from 0 to 0.95"),
        ("poor,loss=nan", "loss is a number"),
        ("poor,loss=1", "loss is a number"),
        ("poor,period_s=0", "period_s is a number from 0.1"),
        ("poor,height_sigma_m=-1", "height_sigma_m is a number from 0"),
        ("poor,age_reported=1", "age_reported is true or false"),
        ("poor,loss=0.1,loss=0.2", "loss twice"),
        ("poor,loss=0.9", "loss 0.9 needs longer bursts"),
    ],
)
def test_another_preset_is_refused_in_one_line(name: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Plan(1, surveillance=(name,))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("preset", SURVEILLANCE_PRESETS)
def test_only_some_receivers_state_an_accuracy(preset: str) -> None:
    how = surveillance_of(preset)
    observer = Observer(generate("hovering", 2, 3), replace(how, loss=0.0, first_heard_m=1e6))
    report = as_report(observer.reports(0.0)[0], 0.0, observer.stated_sigma_m)
    stated = how.position_sigma_m if preset in ("gdl90-1hz", "remote-id") else None
    assert report.position_sigma_m == stated
