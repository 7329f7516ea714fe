"""Growth rates from the areas and volumes of brains of several ages."""
