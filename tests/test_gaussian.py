"""Deviates become points with the mean and covariance asked for, and points become deviates again."""

import numpy as np

from inverse.gaussian import Gaussian
from tests.targets import correlated


def test_points_have_the_covariance_and_go_back_to_their_deviates():
    centre, covariance = np.arange(4.0), correlated(4)
    gaussian = Gaussian.about(centre, covariance)
    deviates = np.random.default_rng(0).standard_normal((50, 4))
    np.testing.assert_allclose(gaussian.factor @ gaussian.factor.T, covariance, atol=1e-11)
    np.testing.assert_allclose(gaussian.at(np.zeros((1, 4))), centre[None])
    np.testing.assert_allclose(gaussian.deviates(gaussian.at(deviates)), deviates, atol=1e-9)


def test_a_covariance_without_extent_in_one_direction_is_taken():
    gaussian = Gaussian.about(np.zeros(2), np.ones((2, 2)))
    assert np.ptp(gaussian.at(np.array([[1.0, 2.0]]))) < 1e-5
