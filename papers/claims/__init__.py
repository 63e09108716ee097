"""What the two works claim, beside what studies of this program give: a module per part of the physics."""
