import numpy as np
import pytest
from known_systems import assert_follows_cdf, bare_line, decay
from numpy.testing import assert_array_equal
from scipy.stats import gamma

from kinetics.rates import ChannelRate, Convention, Rates
from kinetics.rates.rates import SHIPPED

TABLE = (SHIPPED / "table3.toml").read_text(encoding="utf-8")


def measured(events=50):
    channels = {
        name: ChannelRate(rate=1e-4, low=5e-5, high=2e-4, ways=ways, events=events, exposure=events / 1e-4)
        for name, ways in zip(bare_line().channels, bare_line().ways, strict=True)
    }
    evidence = {"scene": "0123", "seeds": [1, 2, 3], "cpu_seconds": 12.5, "versions": {"numpy": "2"}}
    return Rates(convention=Convention(combinations="distinct"), channels=channels, evidence=evidence)


@pytest.mark.parametrize(
    ("name", "joins", "breaks", "combinations"),
    [
        ("table3", [2, 2, 2, 2], [1, 1, 1, 1], "distinct"),
        ("table3_geometric", [4, 4, 4, 4], [1, 2, 2, 1], "distinct"),
        ("table3_literal", [4, 4, 4, 4], [1, 1, 1, 1], "product"),
    ],
)
def test_shipped_tables(name, joins, breaks, combinations):
    net = Rates.load(name).apply(bare_line())
    assert_array_equal(net.ways, joins + breaks)
    assert net.combinations == combinations
    assert_array_equal(net.rate_constants, [7.88e-5, 9.29e-5, 5.32e-5, 6.29e-5, 4.53e-5, 3.89e-5, 0.77e-5, 1.2e-5])
    assert net.conserved.keys() == {"cubes"}


def test_every_shipped_table_says_how_it_was_read():
    for path in SHIPPED.glob("*.toml"):
        assert "reading" in Rates.load(path).evidence


def test_round_trip(tmp_path):
    rates = measured()
    rates.save(tmp_path / "rates.toml")
    assert Rates.load(tmp_path / "rates.toml") == rates
    assert [path.name for path in tmp_path.iterdir()] == ["rates.toml"]


def test_order_of_channels_does_not_matter():
    rates = measured()
    turned = rates.replace(channels=dict(reversed(rates.channels.items())))
    assert_array_equal(turned.apply(bare_line()).ways, bare_line().ways)


def test_a_failed_save_keeps_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "rates.toml"
    measured(50).save(target)

    def crash(descriptor):
        raise OSError("disk full")

    monkeypatch.setattr("os.fsync", crash)
    with pytest.raises(OSError, match="disk full"):
        measured(60).save(target)
    assert Rates.load(target) == measured(50)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("evidence", [{"seeds": list(range(20_000))}, {"nothing": [None]}])
def test_evidence_that_could_not_be_read_back(tmp_path, evidence):
    rates = measured().replace(evidence=evidence)
    with pytest.raises(ValueError, match=r"shorten the evidence|does not fit into TOML"):
        rates.save(tmp_path / "rates.toml")
    assert not list(tmp_path.iterdir())


def test_rates_for_another_network():
    with pytest.raises(ValueError, match=r"another network \(missing decay; not in the network: 1\+1->2, 1\+2->3"):
        measured().apply(decay())
    fewer = measured().replace(channels=dict(list(measured().channels.items())[:-1]))
    with pytest.raises(ValueError, match=r"another network \(missing 4->2\+2\)"):
        fewer.apply(bare_line())
    stamped = measured().replace(network=decay().fingerprint)
    with pytest.raises(ValueError, match="same names, but its fingerprint"):
        stamped.apply(bare_line())
    measured().replace(network=bare_line().fingerprint).apply(bare_line())


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("[convention]", "[conventions]", "'convention' is missing"),
        ('combinations = "distinct"', "", "'convention.combinations' is missing"),
        ('combinations = "distinct"', 'combinations = "unlike"', "convention.combinations = 'unlike'"),
        ('"rate * ways * combinations"', '"rate * combinations"', "convention.propensity"),
        ('time_unit = "tu"', "time_unit = 3", "convention.time_unit = 3"),
        ("rate = 7.88e-5", "rate = nan", "rate = nan"),
        ("rate = 7.88e-5", "rate = inf", "rate = inf"),
        ("rate = 7.88e-5", "rate = -1.0", r"rate = -1\.0"),
        ("rate = 7.88e-5", 'rate = "quick"', "rate = 'quick'"),
        ("rate = 7.88e-5, ways = 2", "rate = 7.88e-5", "ways' is missing"),
        ("rate = 7.88e-5, ways = 2", "rate = 7.88e-5, ways = 0", "ways = 0"),
        ("rate = 7.88e-5", "rate = 7.88e-5, low = 8e-5, high = 9e-5", "expected low <= rate <= high"),
        ("rate = 7.88e-5", "rate = 7.88e-5, low = 7e-5", "low and high must be given together"),
        ("rate = 7.88e-5", "rate = 7.88e-5, events = 5", "events and exposure must be given together"),
        ("rate = 7.88e-5", "rate = 7.88e-5, events = 5.5, exposure = 1", r"events = 5\.5"),
        ("rate = 7.88e-5", "rate = 7.88e-5, events = 5, exposure = 0", "exposure = 0"),
        ("rate = 7.88e-5", "rate = 7.88e-5, error = 1", "unknown key"),
        ("[channels]", "[channels", "is not valid TOML"),
        (TABLE, "", "'convention' is missing"),
    ],
)
def test_bad_files(tmp_path, before, after, message):
    path = tmp_path / "rates.toml"
    assert before in TABLE
    path.write_text(TABLE.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        Rates.load(path)


def test_unreadable_files(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        Rates.load(tmp_path / "rates.toml")
    with pytest.raises(ValueError, match="unknown rates 'table4'; shipped are table3, table3_geometric"):
        Rates.load("table4")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="not UTF-8"):
        Rates.load(binary)


def test_draws_follow_the_posterior():
    draws = measured(events=3).draw_constants(bare_line(), np.random.default_rng(2), 20_000)
    assert draws.shape == (20_000, 8)
    for column in draws.T:
        assert_follows_cdf(column, gamma(3.5, scale=1e-4 / 3).cdf)
    with pytest.raises(AssertionError):  # a prior of one event instead of a half
        assert_follows_cdf(draws[:, 0], gamma(4.0, scale=1e-4 / 3).cdf)


def test_draws_without_evidence_are_the_rates_themselves():
    rates = Rates.load("table3")
    draws = rates.draw_constants(bare_line(), np.random.default_rng(2), 3)
    assert_array_equal(draws, [rates.apply(bare_line()).rate_constants] * 3)
    assert rates.without_evidence() == list(rates.channels)
    assert measured().without_evidence() == []
