"""The filters of SAE J211 that criteria name: gain and phase."""

import numpy as np
import pytest
from scipy.signal import freqz
from tiefmu.acceptance.quantities import coefficients, filtered

CORRIDOR = {60: 100, 180: 300, 600: 1000, 1000: 1650}  # class: frequency of -3 dB, Hz


@pytest.mark.parametrize("frequency_class", CORRIDOR)
def test_gain_lies_in_the_corridor_of_the_standard(frequency_class):
    """SAE J211-1, figure 1: within 0.5 dB in the pass band, +0.5 to -1 dB at the class's frequency F_H, +0.5 to -4 dB
    at F_N; beyond, between -9 and -24 dB an octave, down to the floor of -30 dB (-40 dB from class 600 on)."""
    step = 1 / (100 * frequency_class)
    high, end = frequency_class, CORRIDOR[frequency_class]

    def gain(frequency):  # of both passes
        response = freqz(*coefficients(frequency_class, step), worN=np.atleast_1d(frequency), fs=1 / step)[1]
        return 20 * np.log10(np.abs(response) ** 2)

    assert np.abs(gain(np.geomspace(0.1, high, 200))).max() <= 0.5
    assert -1 <= gain(high)[0] <= 0.5
    assert gain(end)[0] == pytest.approx(-3, abs=0.15)
    floor = -30 if frequency_class < 600 else -40
    beyond = np.geomspace(end, 0.4 / step, 200)
    octaves = np.log2(beyond / end)
    values = gain(beyond)
    assert (values <= np.maximum(0.5 - 9 * octaves, floor)).all()
    lower = -4 - 24 * octaves
    assert (values >= lower)[lower > floor].all()


@pytest.mark.parametrize("frequency_class", CORRIDOR)
def test_a_filter_has_no_phase(frequency_class):
    step = 1 / (20 * frequency_class)
    time = step * np.arange(2000)
    for frequency in (0.2 * frequency_class, frequency_class):
        wave = np.exp(2j * np.pi * frequency * time)
        real, imaginary = (filtered(time, part, frequency_class)[1] for part in (wave.real, wave.imag))
        ratio = ((real + 1j * imaginary) / wave)[500:1500]
        expected = np.abs(freqz(*coefficients(frequency_class, step), worN=[frequency], fs=1 / step)[1]) ** 2
        assert ratio == pytest.approx(np.full(1000, expected[0]), rel=1e-6)
    line = 3 - 2 * time
    assert filtered(time, line, frequency_class)[1] == pytest.approx(line, abs=1e-9 * np.abs(line).max())
