"""Whether laws of adhesion of one work of adhesion pull off at one force as their range falls."""
