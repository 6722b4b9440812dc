"""FMUs without equations, diagnosed from outside: what their outputs lack, as a component that stands behind them."""
