"""The massless limit of the paper's model, by implicit steps of second order whose length follows the error."""
