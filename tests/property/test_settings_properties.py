"""Any sequence of PARAM_SET is answered without error, and the configuration stays valid."""

import struct
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from companion.engine import Engine, EngineConfig, Save, Transmit
from companion.gcs.parameters import BY_NAME, GCS_PARAMETERS, as_sent, values_changed, with_values
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact

US = (1, 196)
ADAPTER: TypeAdapter[Any] = TypeAdapter(EngineConfig)

any_bits = st.integers(0, 2**32 - 1).map(lambda bits: struct.unpack("<f", struct.pack("<I", bits))[0])
in_range = st.sampled_from(GCS_PARAMETERS).flatmap(
    lambda t: st.tuples(st.just(t.name), st.floats(t.lowest, t.highest, width=64))
)
anything = st.tuples(
    st.sampled_from([*BY_NAME, "CA_OTHER", "X", ""]),
    st.one_of(any_bits, st.floats(width=32), st.sampled_from([0.0, 1.0, 10.0, 50.0, 300.0, 1500.0])),
)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.one_of(in_range, anything), st.sampled_from([9, 9, 9, 1, 6, 10, 255])), max_size=40)
)
def test_any_parameter_requests_leave_a_valid_configuration(
    requests: list[tuple[tuple[str, float], int]],
) -> None:
    engine, encoder, splitter = Engine(), Encoder(), FrameSplitter()
    saved: dict[str, float] = {}
    for count, ((name, value), kind) in enumerate(requests):
        message = mavlink.MAVLink_param_set_message(*US, name.encode(), value, kind)
        (frame,) = splitter.feed_datagram(encoder.encode(message, 255, 190))
        now_s = count / 10
        fact = frame_to_fact(frame, now_s)
        assert (fact is None) == (name == "")
        before = engine.operator.settings.config
        answered = fact is not None and engine.receive(fact, now_s)
        assert answered == (name in BY_NAME)
        effects = engine.tick(now_s)
        answers = [
            effect.message
            for effect in effects
            if isinstance(effect, Transmit) and effect.message.get_type() == "PARAM_VALUE"
        ]
        assert len(answers) == (name in BY_NAME)
        config = engine.operator.settings.config
        if config is not before:
            assert ADAPTER.validate_json(ADAPTER.dump_json(config), strict=True) == config
        for answer in answers:
            assert as_sent(answer.param_value) == BY_NAME[name].value(config)
        for effect in effects:
            if isinstance(effect, Save):
                saved = dict(effect.values)
    # A start with the settings saved last gives the same configuration.
    assert saved == values_changed(engine.operator.settings.config, EngineConfig())
    again, refused = with_values(EngineConfig(), saved)
    assert (again, refused) == (engine.operator.settings.config, [])
