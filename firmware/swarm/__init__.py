"""Many virtual stations that drive and send what real ones would, when real ones would."""
