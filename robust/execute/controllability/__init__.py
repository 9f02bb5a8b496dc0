"""Can the schedule that a box promises be found while its values are being revealed? Weak, dynamic and strong."""
