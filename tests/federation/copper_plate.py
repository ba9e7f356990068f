"""A grid that somebody else has written: a copper plate as a plain HELICS federate. Usage: copper_plate.py BROKER STEP STEPS FEDERATE,FEDERATE,...

All batteries meet at one bus: their droops make one frequency, and the load is shared so that all agree. It knows nothing
of `bess` but the names, types and units in docs/distributed.md."""

import json
import sys

import helics

LOAD, K_Q, V_LOAD = 3.0, 0.02, 1.0
# Those of case1.
K_P = [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044]


def main(broker, step, steps, federates):
    host, port = broker.split(":")
    information = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(information, "zmq")
    helics.helicsFederateInfoSetCoreInitString(
        information, f"--federates=1 --broker_address={host} --brokerport={port}"
    )
    helics.helicsFederateInfoSetTimeProperty(information, helics.helics_property_time_period, step)
    helics.helicsFederateInfoSetFlagOption(information, helics.helics_flag_uninterruptible, True)
    own = helics.helicsCreateValueFederate("grid", information)
    vector = helics.helics_data_type_vector
    told, heard = {}, {}
    for name in federates:
        for quantity, unit in (("P", "pu"), ("Q", "pu"), ("V", "pu"), ("omega", "pu"), ("E", "pu.h")):
            key = f"grid/{name}/{quantity}"
            told[name, quantity] = helics.helicsFederateRegisterGlobalPublication(own, key, vector, unit)
        for quantity in ("omega_set", "V_set", "P_set"):
            heard[name, quantity] = helics.helicsFederateRegisterSubscription(own, f"{name}/grid/{quantity}", "pu")

    def setpoints(quantity):
        values = []
        for name in federates:
            values += helics.helicsInputGetVector(heard[name, quantity])
        return values

    def tell():
        omega_set, v_set, p_set = (setpoints(quantity) for quantity in ("omega_set", "V_set", "P_set"))
        # omega = omega_set_i - K_P_i (P_i - P_set_i) for all i, and the sum of P_i is the load.
        share = sum(1 / k for k in K_P)
        omega = (sum((o + k * p) / k for o, p, k in zip(omega_set, p_set, K_P)) - LOAD) / share
        power = [(o - omega) / k + p for o, p, k in zip(omega_set, p_set, K_P)]
        values = {
            "P": power,
            "Q": [(v - V_LOAD) / K_Q for v in v_set],
            "V": [V_LOAD] * len(v_set),
            "omega": [omega] * len(power),
            "E": [80.0] * len(power),
        }
        at = 0
        for name in federates:
            count = len(helics.helicsInputGetVector(heard[name, "omega_set"]))
            for quantity, all_of_it in values.items():
                helics.helicsPublicationPublishVector(told[name, quantity], all_of_it[at : at + count])
            at += count
        return power, omega

    helics.helicsFederateEnterInitializingMode(own)
    helics.helicsFederateEnterExecutingMode(own)
    for k in range(steps + 1):
        if k > 0:
            helics.helicsFederateRequestTime(own, k * step)
        power, omega = tell()
    helics.helicsFederateDisconnect(own)
    helics.helicsCloseLibrary()
    print(json.dumps({"P": power, "omega": omega, "K_P": K_P}))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), sys.argv[4].split(","))
