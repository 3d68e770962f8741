"""Trained policies as data, and what runs them; NumPy is all it needs."""

from hprs.deploy.archive import load_bundle as load_bundle
from hprs.deploy.archive import save_bundle as save_bundle
from hprs.deploy.bundle import Bundle as Bundle
from hprs.deploy.bundle import Layer as Layer
from hprs.deploy.layouts import ActionLayout as ActionLayout
from hprs.deploy.layouts import BoxLayout as BoxLayout
from hprs.deploy.layouts import ChoiceLayout as ChoiceLayout
from hprs.deploy.layouts import ObservationLayout as ObservationLayout
